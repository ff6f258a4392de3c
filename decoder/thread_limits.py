"""Threads of the libraries' own: none. The work for one frame is too small to share, and a thread without any spins."""

from __future__ import annotations

ONE_EACH = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""For the environment of a process before it imports numpy; later is too late."""
