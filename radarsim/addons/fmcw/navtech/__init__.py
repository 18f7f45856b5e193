"""The protocol that Navtech's radars speak, which is called Colossus; without I/O."""
