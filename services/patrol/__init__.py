"""Patrol: routes that are taught by driving, rounds that repeat them, schedule and ledger."""
