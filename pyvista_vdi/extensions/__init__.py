"""What is built on the core: each folder can be deleted, and the core goes on."""
