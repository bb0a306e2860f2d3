"""All Warp code, on flat arrays; knows no other folder."""
