"""The last stage: what a fit returns, measured, and the folder that it is saved in."""
