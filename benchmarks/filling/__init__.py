"""What benchmarks/inpainting.py is made of: holes, ways to fill them, measures, tables, strips to look at."""
