"""Bodies: what a brain can live in. This is the composition root, where files are read."""
