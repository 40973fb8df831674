"""Files in and out: pose graphs (g2o, TORO), floor plans, and the conversion to GTSAM; a format a file."""
