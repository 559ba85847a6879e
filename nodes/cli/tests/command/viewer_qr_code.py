"""Reads a QR code of versions 1 to 5, level L, from half blocks of text; prints its content.

Follows ISO/IEC 18004 without error correction, so that a wrong module is an error or a wrong text.
"""
import sys

BLOCKS = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}
MASKS = [
    lambda i, j: (i + j) % 2,
    lambda i, j: i % 2,
    lambda i, j: j % 3,
    lambda i, j: (i + j) % 3,
    lambda i, j: (i // 2 + j // 3) % 2,
    lambda i, j: i * j % 2 + i * j % 3,
    lambda i, j: (i * j % 2 + i * j % 3) % 2,
    lambda i, j: ((i + j) % 2 + i * j % 3) % 2,
]
ALPHANUMERIC = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ $%*+-./:"
MARGIN = 4

rows = []
for line in sys.stdin.read().splitlines():
    pairs = [BLOCKS[character] for character in line]
    rows += [[upper for upper, _ in pairs], [lower for _, lower in pairs]]
size = len(rows[0]) - 2 * MARGIN
assert size in range(21, 38, 4), size
assert not any(map(any, rows[:MARGIN] + rows[MARGIN + size:]))
rows = [row[MARGIN:MARGIN + size] for row in rows[MARGIN:MARGIN + size]]

around = [(8, j) for j in (0, 1, 2, 3, 4, 5, 7, 8)] + [(i, 8) for i in (7, 5, 4, 3, 2, 1, 0)]
information = int("".join(str(rows[i][j]) for i, j in around), 2) ^ 0b101010000010010
assert information >> 13 == 0b01, "level L"
mask = MASKS[information >> 10 & 7]


def is_data(i, j):
    at_finder = i < 9 and j < 9 or i < 9 and j >= size - 8 or i >= size - 8 and j < 9
    at_alignment = size > 21 and abs(i - size + 7) <= 2 and abs(j - size + 7) <= 2
    return not at_finder and not at_alignment and i != 6 and j != 6


bits = ""
upwards = True
for right in [column for column in range(size - 1, 6, -2)] + [5, 3, 1]:
    for i in range(size)[::-1] if upwards else range(size):
        for j in (right, right - 1):
            if is_data(i, j):
                bits += str(rows[i][j] ^ (mask(i, j) == 0))
    upwards = not upwards


def take(count):
    global bits
    value, bits = int(bits[:count], 2), bits[count:]
    return value


text = ""
while mode := take(4):
    if mode == 1:
        count = take(10)
        for left in range(count, 0, -3):
            digits = min(left, 3)
            text += str(take((4, 7, 10)[digits - 1])).zfill(digits)
    elif mode == 2:
        count = take(9)
        for left in range(count, 0, -2):
            value = take(11 if left > 1 else 6)
            text += (ALPHANUMERIC[value // 45] if left > 1 else "") + ALPHANUMERIC[value % 45]
    else:
        assert mode == 4, mode
        text += bytes(take(8) for _ in range(take(8))).decode()
print(text)
