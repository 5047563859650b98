"""Compiled loops of breeding. Slow twins stand in tests/naive.py."""

from evocity.accelerate import kernel


@kernel
def outline_difference(current, brought, top, left, tall, wide):
    """Mean |brought − current| over the rectangle's outline pixels, sides that lie on the map's
    own border left out (no fabric is cut there); 0 if all do."""
    rows, columns = current.shape
    bottom, right = top + tall - 1, left + wide - 1
    total, count = 0.0, 0
    for x in range(left, right + 1):
        if top > 0:
            total += abs(brought[top, x] - current[top, x])
            count += 1
        if bottom < rows - 1:
            total += abs(brought[bottom, x] - current[bottom, x])
            count += 1
    for y in range(top, bottom + 1):
        if left > 0:
            total += abs(brought[y, left] - current[y, left])
            count += 1
        if right < columns - 1:
            total += abs(brought[y, right] - current[y, right])
            count += 1
    return total / count if count else 0.0


@kernel
def inject(current, brought, owner, donor, size, block, rows, columns, tolerance, least, most):
    """Lay macro-blocks of ``size`` blocks from ``brought`` onto ``current``, in the order of the
    candidate corners (rows, columns, in blocks), each where its outline differs by at most
    ``tolerance``, until ``donor`` owns ``least`` blocks; never beyond ``most``.

    ``current`` (pixels) and ``owner`` (blocks) are changed in place. Returns the blocks owned.
    """
    owned = 0
    for value in owner.ravel():
        if value == donor:
            owned += 1
    for k in range(rows.size):
        if owned >= least:
            break
        top, left = rows[k], columns[k]
        gained = 0
        for i in range(top, top + size):
            for j in range(left, left + size):
                if owner[i, j] != donor:
                    gained += 1
        if gained == 0 or owned + gained > most:
            continue
        y, x, side = top * block, left * block, size * block
        if outline_difference(current, brought, y, x, side, side) > tolerance:
            continue
        for i in range(y, y + side):
            for j in range(x, x + side):
                current[i, j] = brought[i, j]
        for i in range(top, top + size):
            for j in range(left, left + size):
                owner[i, j] = donor
        owned += gained
    return owned
