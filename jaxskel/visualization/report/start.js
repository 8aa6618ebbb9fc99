new Player();
