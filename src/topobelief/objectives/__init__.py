"""What is minimised, one file per objective, each written in terms of forms."""
