"""Files that somebody sends: believed in nothing, checked by their headers, read by a limited child."""
