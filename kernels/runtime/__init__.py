"""Devices, launches, threads, the kernel cache: what every kernel needs to run."""
