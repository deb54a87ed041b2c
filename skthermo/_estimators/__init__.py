"""Warnings that point to the user's line, and threads of BLAS."""
