"""Regions to assembly: propose, select by gain, refine, prune, round by round."""
