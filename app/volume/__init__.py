"""Room volumes (T, p, u on vertices): reading, comparing and scoring them."""
