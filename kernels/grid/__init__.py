"""Regular grids: distance transforms, lists of cells, morphology."""
