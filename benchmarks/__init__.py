"""What the numbers are: accuracy beside the thesis's tables, speed and memory as ratios. Run by `make bench`."""
