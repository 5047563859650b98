/** The position of the sun. */

const RADIANS = Math.PI / 180;
const sine = (degrees) => Math.sin(degrees * RADIANS), cosine = (degrees) => Math.cos(degrees * RADIANS);

/** The declination of the sun in degrees, on a date "2026-12-21" at an hour. The low-precision formulas of the
 * Astronomical Almanac: accurate to .01 degrees at Greenwich from 1950 to 2050, and to .2 elsewhere, where the hour is
 * another moment. */
export function declination(date, hour) {
  const days = (Date.parse(`${date}T00:00:00Z`) - Date.UTC(2000, 0, 1, 12)) / 864e5 + hour / 24;
  const anomaly = 357.528 + 0.9856003 * days;
  const along = 280.46 + 0.9856474 * days + 1.915 * sine(anomaly) + 0.02 * sine(2 * anomaly); // the ecliptic
  return Math.asin(sine(23.439 - 4e-7 * days) * sine(along)) / RADIANS;
}

/** {azimuth, height} of the sun, degrees clockwise from north and above the horizon (negative below): at a latitude in
 * degrees, north positive, on a date "2026-12-21". The hour is solar time: the sun is highest at noon. */
export function sunAt(latitude, date, hour) {
  const over = declination(date, hour), turn = 15 * (hour - 12); // to the west
  const east = -cosine(over) * sine(turn);
  const north = cosine(latitude) * sine(over) - sine(latitude) * cosine(over) * cosine(turn);
  const up = sine(latitude) * sine(over) + cosine(latitude) * cosine(over) * cosine(turn);
  return {
    azimuth: (Math.atan2(east, north) / RADIANS + 360) % 360,
    height: Math.atan2(up, Math.hypot(east, north)) / RADIANS,
  };
}
