"""Places on the earth of offsets from where the drive begins."""

import numpy

# WGS 84, and a place on it: the antenna where the drive begins. The geoid is that far above the ellipsoid.
SEMI_MAJOR_M, FLATTENING = 6_378_137.0, 1 / 298.257223563
PLACE_DEG, PLACE_HEIGHT_M, UNDULATION_M = (49.011, 8.416), 115.0, 48.25


def local_level(latitude, longitude):
    """Columns east, north, up in the axes of the earth."""
    (a, b), (x, y) = numpy.cos([latitude, longitude]), numpy.sin([latitude, longitude])
    return numpy.array([[-y, -x * b, a * b], [b, -x * y, a * y], [0, a, x]])


def earth_m(latitude, longitude, height_m):
    """Place in the axes of the earth."""
    squared = FLATTENING * (2 - FLATTENING)
    radius_m = SEMI_MAJOR_M / numpy.sqrt(1 - squared * numpy.sin(latitude) ** 2)
    flat = (radius_m + height_m) * numpy.cos(latitude)
    up = (radius_m * (1 - squared) + height_m) * numpy.sin(latitude)
    return numpy.array([flat * numpy.cos(longitude), flat * numpy.sin(longitude), up])


def place_of(offset_m):
    """Latitude and longitude in degrees and height of an offset east, north, up of the place."""
    begin = [*numpy.radians(PLACE_DEG), PLACE_HEIGHT_M]
    target = earth_m(*begin) + local_level(*begin[:2]) @ offset_m
    place = numpy.array(begin)
    # Newton's method with the radius of the sphere: each step gains five digits.
    for _ in range(6):
        east, north, up = local_level(*place[:2]).T @ (target - earth_m(*place))
        place += [north / SEMI_MAJOR_M, east / (SEMI_MAJOR_M * numpy.cos(place[0])), up]
    return *numpy.degrees(place[:2]), place[2]
