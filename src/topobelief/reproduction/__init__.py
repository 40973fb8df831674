"""The experiments of the paper (arXiv 1903.00927) and some beyond it, a table or figure a file, and which claims hold."""
