"""The exporter: what was heard, what is told of it, and a real scrape."""
