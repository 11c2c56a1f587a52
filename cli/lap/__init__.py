"""The demo's lap: what is driven, who drives it, how it looks and what came of it."""
