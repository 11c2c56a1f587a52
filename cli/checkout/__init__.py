"""Checking a real vehicle out before its first drive: `t2 checkout`."""
