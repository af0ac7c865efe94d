"""What commands have learned of virtual greenhouses, for every other: bounds of gains and skills, rules."""
