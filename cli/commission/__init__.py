"""``t2 checkout``: the checks of a real vehicle before its first drive."""
