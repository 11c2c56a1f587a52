"""What Prometheus is told of one robot or of many."""
