"""Number of particles by KLD sampling (Fox), and its parameters."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.amcl.particles.resample_kernels import kld_size


@dataclass(frozen=True, kw_only=True)
class KldRule:
    """Fewest and most particles, largest error, upper quantile z.

    Differs from upstream: particles that are all in one bin need the fewest, not the most.
    """

    least: int = 100
    most: int = 5000
    error: float = 0.01
    z: float = 0.99

    def size(self, bins: int) -> int:
        """Number of particles for a spread over `bins` bins."""
        return int(kld_size(bins, self.error, self.z, self.least, self.most))
