"""The T2 micro-services; each imports ``common`` and never another service."""
