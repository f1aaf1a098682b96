"""Reading and writing files safely: durable writes, TOML, pictures, uploads."""
