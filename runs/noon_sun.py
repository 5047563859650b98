"""A measure of your own: the worked example of docs/fitness.md."""

import numpy as np

import evocity

#: The sun at noon on the shortest day at 45° north stands 21.5° above the horizon.
CLIMB = np.tan(np.radians(21.5))


@evocity.fitness(goal="max", range=(0, 1))
def noon_sun(city):
    """Share of the open ground that lies in the sun at noon on the shortest day.

    Formula: a pixel is in the shade if any roof due south of it stands higher than the ray
    from it to the sun: h > distance · tan 21.5°. Sunny open pixels / open pixels.
    Unit: none. Range: 0 to 1. Empty map: 1, nothing throws a shadow; NaN without open ground.
    Source: ours; 21.5° is the sun's height at 45° north (Lyon, Montpellier, Bordeaux).
    """
    open_ground = ~city.built
    if not open_ground.any():
        return evocity.fitness.Undefined("no open ground")
    return (open_ground & ~shade(city)).sum() / open_ground.sum()


def shade(city):
    """Bool (H, W): where no sun reaches the ground. Row 0 is in the north."""
    shaded = np.zeros(city.shape, bool)
    step = city.metres_per_pixel * CLIMB  # the rise of the ray over a pixel
    for k in range(1, int(city.heights.max() / step) + 1):
        shaded[:-k] |= city.heights[k:] > k * step
    return shaded
