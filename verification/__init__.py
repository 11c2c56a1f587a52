"""What verifies the stack and never ships.

Each package is a program: ``python -m verification.faults``. They share ``verification.harness``.
"""
