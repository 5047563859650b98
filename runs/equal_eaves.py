"""A measure of one's own: façades of equal eaves, as along a street that was built in one go."""

import math

import numpy as np

import evocity

ALONG = 6.0  # metres along the street, to either side
ALIKE = 0.5  # metres by which eaves may differ


@evocity.fitness(goal="max", range=(0, 1))
def equal_eaves(city):
    """Share of the façades that go on at the same height to both sides.

    A façade pixel is built and has open ground beside it. It counts if, 6 m along the street to
    either side, there is a façade pixel within 0.5 m of its height, at most one pixel nearer to
    the street or farther from it. NaN without a façade.
    """
    step = max(1, round(ALONG / city.metres_per_pixel))
    facing = [facade(city.built, side) for side in range(4)]  # north, west, south, east
    anywhere = np.logical_or.reduce(facing)
    if not anywhere.any():
        return evocity.fitness.Undefined("no façade")
    heights = np.where(anywhere, city.heights, math.inf)
    along_x, along_y = goes_on(heights, step), goes_on(heights.T, step).T
    equal = (facing[0] | facing[2]) & along_x | (facing[1] | facing[3]) & along_y
    return np.count_nonzero(equal) / np.count_nonzero(anywhere)


def facade(built, side):
    """Built pixels with open ground to the north (0), west (1), south (2) or east (3)."""
    turned = np.rot90(built, -side)
    open_north = np.zeros_like(turned)
    open_north[1:] = ~turned[:-1]
    return np.rot90(turned & open_north, side)


def goes_on(heights, step):
    """Pixels that have one of like height ``step`` pixels to the left, and one to the right."""
    padded = np.pad(heights, ((1, 1), (step, step)), constant_values=math.inf)
    rows, columns = heights.shape

    def like(across):
        found = np.zeros(heights.shape, bool)
        for down in (0, 1, 2):
            other = padded[down : down + rows, across : across + columns]
            with np.errstate(invalid="ignore"):  # inf − inf where neither is a façade
                found |= np.abs(other - heights) <= ALIKE
        return found

    return like(0) & like(2 * step)
