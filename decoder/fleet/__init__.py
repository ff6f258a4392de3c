"""Many flights at once: from an archive of flight files to flight data and one index, here or on a cluster."""
