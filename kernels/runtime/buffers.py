"""Arrays that the host and the device share."""

from __future__ import annotations

import numpy as np
import warp as wp


class Buffer:
    """An array that the host fills and the device reads, or the other way round; one memory on the CPU."""

    def __init__(self, size: int, dtype: type, device: wp.Device):
        """`size` zeros, one at least."""
        self.host = np.zeros(max(1, size), dtype)
        scalar = wp.dtype_from_numpy(self.host.dtype)
        self.array = wp.array(self.host, dtype=scalar, device=device, copy=not device.is_cpu)

    def upload(self) -> None:
        """Bring what the host wrote to the device."""
        if not self.array.device.is_cpu:
            self.array.assign(self.host)

    def download(self) -> np.ndarray:
        """Copy to `host` what the device wrote, and return it."""
        if not self.array.device.is_cpu:
            self.host[:] = self.array.numpy()
        return self.host
