"""B-splines: curves, surfaces and volumes, their evaluation, quadrature and root finding."""
