"""What every frame begins with, little-endian (manual 2.1).

====== ======= ========================================================================
offset bytes   field
====== ======= ========================================================================
0      2       magic, ``47 53`` ("GS")
2      2       size of the whole frame, header included
4      2       command id, see ``commands`` and ``reports``
6      2       CRC, over the payload alone: the header is not protected
8      size-8  payload
====== ======= ========================================================================

What stands before the CRC is the same in all frames of a kind: the *opening*, by which it is known.
"""

from struct import Struct

MAGIC = b"GS"
OPENING = Struct("<2sHH")  # magic, size, id
HEADER = Struct("<6sH")  # opening, CRC
CRC_OFFSET, PAYLOAD_OFFSET = 6, 8
