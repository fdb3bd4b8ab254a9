#!/usr/bin/env python3
"""screen.py FILE X Y [X Y ...]: colours (rrggbb) of pixels in an XWD file, such as the one that Xvfb -fbdir keeps."""
import struct
import sys

data = open(sys.argv[1], "rb").read()
header = struct.unpack(">25I", data[:100])
order = "<" if header[7] == 0 else ">"
start, row, size = header[0] + 12 * header[19], header[12], header[11] // 8
for x, y in zip(sys.argv[2::2], sys.argv[3::2]):
    at = start + int(y) * row + int(x) * size
    print("%06x" % (struct.unpack(order + "I", data[at : at + 4])[0] & 0xFFFFFF))
