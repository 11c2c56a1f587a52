"""Black-box proof: an independent board and plain Zenoh clients against the real processes.

Written from the vehicle's manual, the notes on its wire and ``docs/bus.md`` alone. It imports the
standard library, ``zenoh`` and ``msgpack``, and nothing of this project, so that a mistake in our
own codec, keys or simulator cannot hide itself. The same run takes several trees side by side:
``python -m verification.outside --tree OLD --tree NEW``.
"""
