"""A camera whose pictures were taken before: a folder of JPEGs, or a recorded flight."""
