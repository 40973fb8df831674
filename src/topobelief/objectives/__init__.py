"""What is minimised, an objective a file, each written in terms of forms."""
