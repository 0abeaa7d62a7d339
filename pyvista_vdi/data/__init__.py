"""The shipped volumes (NRRD), with source, terms and checksums in ``README.md`` beside them."""
