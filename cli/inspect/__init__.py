"""Looking at the bus from a laptop: each tool is an ordinary consumer, and any number may run."""
