"""Commands for recordings: info, replay, report and foxglove."""
