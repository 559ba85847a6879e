//! WGS84, ECEF, ENU, GPS time and headings.
