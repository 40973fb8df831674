"""Files in and out: pose graphs in the formats of SLAM systems, paths and floor plans, one file per format."""
