"""Tables, plots and pictures of many fits."""
