"""Objects to grasp: what is known of each, household shapes, scans, and the catalogue of both."""
