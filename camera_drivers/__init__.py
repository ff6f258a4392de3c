"""Camera drivers: each turns a camera, or what stands in for one, into frames."""
