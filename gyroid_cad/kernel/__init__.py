"""The only folder that imports the CAD kernel (OpenCascade, through OCP)."""
