"""Proof of ``t2 fit``: its estimates and proposals against simulated vehicles that are known."""
