"""The paper's neural painting network: see paint.py, and docs/npn.md for its architecture."""
