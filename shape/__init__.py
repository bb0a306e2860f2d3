"""Any mesh, as what the fitter needs: loaded, made a solid, put on a grid, sampled. Start at `target.make_target`."""
