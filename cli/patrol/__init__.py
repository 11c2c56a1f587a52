"""Commands of routes and rounds."""
