"""Long, seeded tests with damaged and hostile input: `make fuzz`. The quick tests do not collect them."""
