"""Records -> tables; two tables -> a verdict. Nothing here renders."""
