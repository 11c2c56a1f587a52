"""T2 beside what a user would pick instead, measured on one machine in one run."""
