"""Black-box tests: an independent board and plain Zenoh clients against the real processes.

Written only from the vehicle's manual, the notes on its wire and ``docs/bus.md``. It imports the
standard library, ``zenoh`` and ``msgpack``, and nothing of this project, so that an error in T2's
codec, keys or simulator cannot hide itself. One run can compare several trees:
``python -m verification.outside --tree OLD --tree NEW``.
"""
