"""CSV tables of measurements: header, columns, cells, and the measurements that they give."""
