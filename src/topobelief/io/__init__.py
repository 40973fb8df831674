"""Files in and out: pose graphs (g2o, TORO) and floor plans, one file per format."""
