"""The page of `wavesweep explore`: a design's boundary and numbers in a browser, served on this
machine or saved as a file."""
