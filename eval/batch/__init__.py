"""Many fits, one process each, with a row of numbers for every one."""
