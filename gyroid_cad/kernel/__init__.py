"""The CAD kernel (OpenCascade, through OCP): surfaces, solids, checks, booleans, reading and writing."""
