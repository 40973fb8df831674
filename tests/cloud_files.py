"""Point clouds as programs write them, the same three points in each format."""

from __future__ import annotations

import struct

import numpy as np

POINTS = np.array([(0.5, -1.25, 2), (3, 4, 5.5), (7, 0, -1)])
PLY = "ply\nformat {} 1.0\ncomment made for a test\nelement vertex 3\nproperty uchar red\nproperty float x\n"
PLY += "property double y\nproperty float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"
PCD = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z normal intensity\nSIZE 4 8 4 4 1\nTYPE F F F F U\nCOUNT 1 1 1 3 1\n"
PCD += "WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA {}\n"


def ply(form: str) -> bytes:
    if form == "ascii":
        return PLY.format(form).encode() + "".join(f"9 {x} {y} {z}\n" for x, y, z in POINTS).encode()
    order = "<" if "little" in form else ">"
    return PLY.format(form).encode() + b"".join(struct.pack(f"{order}Bfdf", 9, *point) for point in POINTS)


def pcd(form: str) -> bytes:
    if form == "ascii":
        return PCD.format(form).encode() + "".join(f"{x} {y} {z} 0 0 1 7\n" for x, y, z in POINTS).encode()
    return PCD.format(form).encode() + b"".join(struct.pack("<fdf3fB", *point, 0, 0, 1, 7) for point in POINTS)


CLOUDS = {
    "a.ply": ply("ascii"),
    "le.ply": ply("binary_little_endian"),
    "be.ply": ply("binary_big_endian"),
    "a.pcd": pcd("ascii"),
    "b.pcd": pcd("binary"),
}
