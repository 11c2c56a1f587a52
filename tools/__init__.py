"""Commands for developers; nothing here ships."""
